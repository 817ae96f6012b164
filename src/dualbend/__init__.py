"""Two position-controlled arms bend a flexible sheet, on validated beam physics."""
