"""Thresholds of deviance: the difference in misfit between two hypotheses that each decision of a search requires.

Unit: deviance, twice the logarithm of a likelihood ratio (`distance.deviance_of`): 2 is the mean reduction by a
meaningless parameter, 6 a likelihood ratio of 20.

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
"""Least promised reduction for another step of the parameters.  Small, since two parameters that compensate each
other may both be far off while little is gained by a step."""

PER_PARAMETER = 2.0
"""Mean reduction by a meaningless parameter (Akaike)."""

BY_CHANCE = 3.0
"""Increase in misfit that chance of the draws can explain."""

TO_JOIN = 4.0
"""Reduction for a later effect to earn a joint refit.  Less than TO_ADD, since earlier effects may have absorbed part
of its signature."""

TO_STEP_SHAPE = 5.0
"""Least promised reduction for a step while candidates are compared: less would not change their order."""

TO_CONTINUE = 5.0
"""Reduction by the best-scaled twin for a candidate's fit to go on."""

TO_PREFER = 6.0
"""Least lead that counts between two candidates: a likelihood ratio of 20."""

TO_ADD = 12.0
"""Reduction in misfit to add an effect."""

TO_DISMISS = 2 * TO_PREFER
"""Lead on recordings to fit up to which all recordings decide: noise beside another effect is known from few twins."""

TO_KEEP = 15.0
"""Increase in misfit without an earlier effect, once another has been added, for the earlier one to be kept."""

TO_CONFIRM = 15.0
"""Distance from the best confirmed fit up to which an unconfirmed one is confirmed as well."""

TO_KEEP_UNTRIED = 10 * TO_KEEP
"""Increase in misfit without an effect that no refit of the unit could compensate: the effect is kept untried."""
