"""The common ground of the experiments: frames, scores, results, figures, and how a command begins.

1. Noisy frames and references are rendered once and kept [`frames.render_all`].
2. Networks are trained once and kept, with their seconds [`training.trained`].
3. A picture is scored against its reference in both spaces [`scores.score`].
4. One record per configuration and seed is kept as JSON, so that an interrupted run resumes
   [`results.Results`], [`results.fill`]; records become means with their spread, and Markdown tables
   [`tables.table`]; values per pose and seed become bootstrap intervals [`intervals.interval`].
5. Contact sheets and curves are PNG [`figures`].
6. Every experiment has the same options [`command.parser`], [`command.begin`].

An experiment is a file in experiments/ that is started as `python experiments/quality.py` is, and imports
this as `lab`.
"""
