"""Sends whom a camera sees to a running twin: `python mediapipe_camera.py 0 127.0.0.1` beside `seerob run`.

Needs `pip install mediapipe==0.10.21` (its wheel brings the model; Python 3.9 to 3.12) and a camera, or the
file of a video instead of its number. With --file it writes the results for kind = "mediapipe_recording".
Newer releases of mediapipe have no `solutions`: use their PoseLandmarker with a model file and send the same.
"""

import argparse
import json
import socket
import time

import cv2
import mediapipe

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("camera", help="number of the camera, or the file of a video")
parser.add_argument("host", nargs="?", default="127.0.0.1", help="machine that runs seerob")
parser.add_argument("--port", type=int, default=9872)
parser.add_argument("--file", help="write results here, one per line, instead of sending them")
options = parser.parse_args()

pictures = cv2.VideoCapture(int(options.camera) if options.camera.isdigit() else options.camera)
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
file = open(options.file, "w") if options.file else None  # noqa: SIM115
with mediapipe.solutions.pose.Pose(model_complexity=1) as pose:
    while True:
        there, picture = pictures.read()
        if not there:
            break
        taken = time.monotonic() * 1e3 if file is None else pictures.get(cv2.CAP_PROP_POS_MSEC)
        found = pose.process(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)).pose_world_landmarks
        people = [] if found is None else [found.landmark]
        landmarks = [
            [{"x": m.x, "y": m.y, "z": m.z, "visibility": m.visibility} for m in person] for person in people
        ]
        text = json.dumps({"timestamp_ms": taken, "pose_world_landmarks": landmarks})
        if file is None:
            link.sendto(text.encode(), (options.host, options.port))
        else:
            print(text, file=file)
