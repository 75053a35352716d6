"""The network: features, SIREN with its backward pass, Adam, training and denoising."""
