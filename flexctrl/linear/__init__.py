"""Linear models as matrices with names: modes, responses, reduction, export; they know no machine."""
