"""A diagnosis in words: sentences, plots, and one page of HTML."""
