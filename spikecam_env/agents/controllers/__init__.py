"""Classical controllers of the MuJoCo tasks: they see pictures and encoders, and learn nothing; a file each."""
