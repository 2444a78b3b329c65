"""The person: skeleton, anthropometry, posture."""
