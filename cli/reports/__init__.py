"""Reports: facts, plots, pages."""
