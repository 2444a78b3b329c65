"""A picture of one instant, drawn without a graphics card."""
