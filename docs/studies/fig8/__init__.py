"""How far the reading of Figs. 6 and 8 holds, and whether feedback or an offset does it."""
