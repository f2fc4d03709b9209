"""What makes the site of the pages in docs/, of the docstrings and of the commands."""
