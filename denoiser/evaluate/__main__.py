"""`python -m denoiser.evaluate`: the quick evaluation, printed."""

from denoiser.evaluate.quick import evaluate_quick, report

if __name__ == "__main__":
    print(report(evaluate_quick()))
