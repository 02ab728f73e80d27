"""Ground floor: number types, threads, captured work, and files that are read without trust."""
