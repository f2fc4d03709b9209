"""Reproductions of the published systems, each against its paper's own tables."""
