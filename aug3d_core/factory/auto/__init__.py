"""No more than a scene needs: the settings that the preset `auto` leaves open, decided when their stage comes.

settle       settle what a stage's settings leave open, just before it is made
rules        the rule for each setting
decision     a decision, and what it was taken from
pictures     rules for the size of pictures
views        rules for virtual views, and for how many inputs a view has
pixelnerf, sweep   rules for the settings of heads
length       how long a head is trained
ground_kind  which surface the ground is taken for
parallax     how far a point moves between the views of a group
rows         the decisions as `metrics.json`, the report and MLflow tell them
"""
