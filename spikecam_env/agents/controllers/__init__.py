"""Classical controllers of MuJoCo tasks, from pictures alone; a file each."""
