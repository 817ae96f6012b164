"""Assembly of sheets on alignment pins."""
