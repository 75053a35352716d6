"""What the paper and today's users compare WAMnet with: networks in PyTorch, and filters without training.

1. DnCNN [`dncnn`] and pix2pix [`pix2pix`], trained by one loop that can be resumed [`fitting`].
2. The spatial filter of SVGF, an edge-avoiding a-trous wavelet transform [`atrous`].
3. A measure of the blocks that denoising in patches leaves [`blocks`].
"""
