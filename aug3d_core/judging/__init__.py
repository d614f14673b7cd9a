"""The stage `evaluation`: a trained head on held-out photographs, beside cheap answers. Knows a predicted View, no head.

config          how the model is judged
stage           the stage: score, draw, report
inputs          which photographs every answer is made from (torch)
scores          scores of every test view
conventions     how answers are scored, with a digest
summary         scores -> means, groups, intervals, of one fold or several (numpy)
cheap_answers   what the model must beat (numpy)
warped_answers  those that move pixels by depth (torch)
names           what people call the answers
panels          pictures to look at
flythrough      a short flight around a test view
video           it as a file that browsers play
"""
