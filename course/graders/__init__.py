"""One grader a lab: checks in the order in which they explain a wrong answer best."""
