"""The factory: the list of stages, their settings, and the loop that builds them in order.

stages         the list: read it first
config         the settings of a scene: presets and overrides
plan           the steps of a run: stages and folds
walk           the loop behind runs, dry runs, trials and studies
build          build one object, or find it in the store
material       what a stage reads
repair         make damaged objects again
auto           settings that are decided from the scene
estimate       what a run will take on this machine; refuse one that does not fit
scheduler      the Dask cluster that may help, if one is named
cluster        shards of a stage over its workers
reference      generate the reference pages in docs/
"""
