"""The rewrites that a traced program goes through, one file each, in the order that the pipeline names."""
