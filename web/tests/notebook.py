"""What a run hands to a notebook's widget, as JSON on the standard output: `python notebook.py FOLDER`."""

import json
import sys
from base64 import b64encode

import seerob as sr

view = sr.load(sys.argv[1]).run().show(height=360)
text = {name: getattr(view, name) for name in ("height", "verdict")}
text["scene"] = b64encode(view.scene).decode()
text["meshes"] = {name: b64encode(mesh).decode() for name, mesh in view.meshes.items()}
text["frames"] = [b64encode(frame).decode() for frame in view.frames]
text["_esm"] = view._esm
json.dump(text, sys.stdout)
