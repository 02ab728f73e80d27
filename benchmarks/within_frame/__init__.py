"""The sensor's engines against the hidden world, which shares no code with them (`tests/hidden_world`)."""
