"""The course: twelve labs and three extras, their graders, and what grades a whole class."""
