"""A run that a page in the browser shows, and that whoever reads the page steers and disturbs."""
