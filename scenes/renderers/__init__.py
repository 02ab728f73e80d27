"""Back-ends that turn a surface in space into a picture of linear light."""
