"""Pictures of streams, and their two ends: a window, or a film."""
