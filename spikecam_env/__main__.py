"""`python -m spikecam_env` is the `spikecam` command."""

from spikecam_env.cli.main import main

main()
