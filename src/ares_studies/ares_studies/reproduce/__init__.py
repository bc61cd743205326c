"""The thesis beside our own results: tables, figures, errata, as one page and one JSON file."""
