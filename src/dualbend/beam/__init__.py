"""What the sheet wants: its material, the elastica, the rod off the optimum, and the paths."""
