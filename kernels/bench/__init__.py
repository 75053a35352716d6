"""Speed against error: what `wamnet bench` measures, its peers, and a model of what each should cost."""
