"""From an assembly or a plant to the files of a workstation folder."""
