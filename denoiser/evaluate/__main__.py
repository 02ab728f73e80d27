"""`python -m denoiser.evaluate`: the quick evaluation, printed."""

from denoiser.evaluate.quick import main

main()
