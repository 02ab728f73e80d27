"""Classical controllers of MuJoCo tasks, a file each: from pictures and encoders to actions, and nothing is learned."""
