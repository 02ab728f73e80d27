"""Thresholds of deviance: by how much less one hypothesis has to leave than another, for each decision of a search.

Unit: deviance, twice the logarithm of a likelihood ratio (`distance.deviance_of`): 2 is what a parameter of no meaning
removes, 6 a likelihood ratio of 20.

    name             value  what is decided                                              compared are
    TO_STEP              1  whether parameters take another step                         a step's prediction, none
    PER_PARAMETER        2  whether a parameter more may be a rival                      two candidates
    BY_CHANCE            3  whether a step, or a fit by more twins, is worse             after, before
    TO_JOIN              4  whether a later effect is fitted with those before it        with it, without
    TO_STEP_SHAPE        5  as TO_STEP, for a candidate that is not chosen yet           a step's prediction, none
    TO_CONTINUE          5  whether a candidate's fit goes on after a twin               the twin, scaled at best, none
    TO_PREFER            6  whether a lead, or a parameter more, counts at all           two candidates
    TO_ADD              12  whether an effect is added                                   with it, without
    TO_DISMISS          12  whether a lead on recordings to fit is final                 two candidates
    TO_KEEP             15  whether an earlier effect stays beside a later one           with it, without
    TO_CONFIRM          15  whether a fit by one twin may still be the best              the fit, the best confirmed
    TO_KEEP_UNTRIED    150  as TO_KEEP, by its change alone, not simulated without       with it, less its change

Sources: PER_PARAMETER is Akaike's and TO_JOIN two of it; TO_PREFER is 2 log 20 and TO_DISMISS two of it.  The others
are choices without a derivation, which the blind trial (docs/blind_trial.md) measures together.
"""

TO_STEP = 1.0
"""A step has to promise it for another: of two parameters that make up for each other either may be open by far, and
both together leave much."""

PER_PARAMETER = 2.0
"""A parameter of no meaning removes so much (Akaike)."""

BY_CHANCE = 3.0
"""A step may seem so much worse, by chance of the draws."""

TO_JOIN = 4.0
"""A later effect has to remove it, while those before it stay as they were fitted without it, to be fitted together
with them: they may have taken its share."""

TO_STEP_SHAPE = 5.0
"""A step has to promise it where candidates are compared: less does not put them in another order."""

TO_CONTINUE = 5.0
"""A twin, scaled at best, has to remove it for its candidate's fit to go on."""

TO_PREFER = 6.0
"""A lead of less says nothing, whatever the draws say: a likelihood ratio of 20."""

TO_ADD = 12.0
"""An effect has to remove it to be added."""

TO_DISMISS = 2 * TO_PREFER
"""One may be so much behind on recordings to fit, and win on all: noise beside another effect is known from few
twins."""

TO_KEEP = 15.0
"""An effect found earlier has to be missed by it, once another has been added, to be kept."""

TO_CONFIRM = 15.0
"""A fit that is not confirmed may be so much worse than the best that is, to be confirmed as well."""

TO_KEEP_UNTRIED = 10 * TO_KEEP
"""An effect is missed by it beyond what a unit refitted without it could make up for."""
