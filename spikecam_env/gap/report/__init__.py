"""What a diagnosis says: sentences, plots, and one page of HTML."""
