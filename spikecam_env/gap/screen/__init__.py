"""Screening: which candidates are fitted, and from which parameters, by templates made beforehand."""
