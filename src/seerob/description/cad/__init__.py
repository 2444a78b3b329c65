"""CAD files: what a file is by its content, and its parts with names, places, colours and surfaces."""
