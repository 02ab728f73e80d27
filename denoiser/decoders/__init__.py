"""Decoders: from rates or intervals to spikes."""
