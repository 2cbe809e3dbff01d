"""What it costs and how far to trust it: responses, comparisons, ledgers."""
