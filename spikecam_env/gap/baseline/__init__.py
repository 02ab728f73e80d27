"""Before anything is searched: what the model as given predicts, what recordings contradict, and what the refit had to move."""
