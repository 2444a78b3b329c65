"""What a contact with a person does: impact, clamping, contact area, permissible speed."""
