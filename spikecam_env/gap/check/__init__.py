"""Before any model: whether recordings are as their labels say.  Motion, levels, order, orientation, missing frames."""
