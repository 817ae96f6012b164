"""What the controller acts on: posed arms, sheet, equilibrium and the coupling of both arms."""
