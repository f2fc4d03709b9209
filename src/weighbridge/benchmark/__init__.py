"""An open benchmark: simulated drives of unknown mass, what methods make of them, and the score."""
