"""How a page looks."""

from spikecam_env.gap.report import plots

STYLE = f"""
body {{ max-width: 1240px }}
header.verdict {{ border-left: 6px solid #888; padding: .2em 0 .2em 1em; margin-bottom: 1em }}
header.none {{ border-color: #009E73 }} header.named {{ border-color: #0072B2 }}
header.class, header.parameter {{ border-color: #56B4E9 }}
header.unknown {{ border-color: #CC79A7 }} header.data {{ border-color: #E69F00 }}
.badge {{ text-transform: uppercase; letter-spacing: .06em; font-size: .8em; font-weight: 600; color: #555; margin: 0 }}
h1 {{ margin: .2em 0; max-width: 46em }} .subject {{ color: #555; margin: .3em 0 }}
p, ul, .card, .do {{ max-width: 60em }}
nav {{ font-size: .9em; color: #777; margin: 1em 0 }} a {{ color: #0059a3 }}
.card, .do {{ border: 1px solid #ddd; border-radius: 6px; padding: .2em 1.2em .6em; margin: 1em 0 }}
.do {{ background: #eef6fb; border-color: #bcdcf0 }}
.caption, .legend {{ color: #444 }} .legend {{ font-size: .95em }}
.key {{ display: inline-block; margin-right: 1em }}
.measured {{ color: {plots.MEASURED} }} .before {{ color: {plots.BEFORE} }} .after {{ color: {plots.AFTER} }}
.band {{ color: #bbb }}
.plots {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 380px), 1fr)); gap: 1em;
          align-items: start }}
.maps {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 260px), 1fr)); gap: .5em }}
.plots img, .maps img, .single img {{ width: 100%; height: auto; display: block }}
.single {{ max-width: 540px }} .maps {{ max-width: 900px }}
tr.accepted td {{ background: #eef6fb }} td:last-child, th:last-child {{ padding-right: 0 }}
summary {{ cursor: pointer; color: #0059a3; margin: 1em 0 }}
pre {{ white-space: pre-wrap; overflow-wrap: anywhere }}
section {{ scroll-margin-top: 1em }}
@media (max-width: 600px) {{ body {{ margin: 1em auto; padding: 0 .8em }} h1 {{ font-size: 1.25em }}
  .card, .do {{ padding: .1em .8em .5em }} .wide table {{ font-size: .92em }} }}
@media print {{ nav {{ display: none }} .exhibit {{ break-inside: avoid }} }}
"""
