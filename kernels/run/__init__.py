"""What runs on an executor: denoising, rendering, pipelines, training and tuning."""
