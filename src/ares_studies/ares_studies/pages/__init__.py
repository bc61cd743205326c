"""What pages are made of: parts of a report as plain data, templates, style, script."""
