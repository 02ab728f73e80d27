"""Which candidates are worth a fit, by templates of what each does."""
