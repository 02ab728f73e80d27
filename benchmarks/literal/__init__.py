"""A camera simulated electron by electron in continuous time, which shares no code with the sensor's engines."""
