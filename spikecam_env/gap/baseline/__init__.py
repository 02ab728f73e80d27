"""Before a search: what the model as given predicts, what recordings contradict, what the refit had to move."""
