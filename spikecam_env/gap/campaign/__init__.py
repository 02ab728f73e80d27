"""Campaigns for a diagnosis: designed and simulated, or made of files of a real camera with labels of their light."""
