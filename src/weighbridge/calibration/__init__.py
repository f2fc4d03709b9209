"""Vehicle parameters from drives of known mass."""
