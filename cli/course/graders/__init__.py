"""One grader a lab: checks in the order of what a wrong answer is best told by."""
