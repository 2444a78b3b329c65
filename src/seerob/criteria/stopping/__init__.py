"""How a robot stops, and the terms of the protective separation distance that follow from it."""
