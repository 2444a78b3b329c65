"""Motion in tables: workbooks and delimited text, whatever their headers call things."""
