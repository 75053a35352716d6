"""Networks of other programs: graphs in ONNX's form become models."""
