"""`python -m spikecam_env` is the `spikecam` command."""

from spikecam_env.cli.entry import main

main()
