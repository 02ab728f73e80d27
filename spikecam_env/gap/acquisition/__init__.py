"""How a campaign comes about: designed and recorded by simulation, or imported from files of a real camera."""
