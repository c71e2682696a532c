"""How results are shown: numbers as text, sections of tables, and the look of pictures."""
