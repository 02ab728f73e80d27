"""Settings at which the sensor is held against the hidden world (`tests/hidden_world`); they share no code."""
