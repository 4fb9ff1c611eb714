"""Contact mechanics on arrays and numbers, with a status for each solution.

`halfplane` has the transition loads of sharp, centred ridges, `contact_solution` a body on any
profile under any load, `reaching` the loads that reach further ridges, `cylinder` the whole body by
finite elements, `hertz` the smooth closed forms. A solution says how many ridges are touched, and
whether it holds:

>>> from ridgebayes.contact.contact_solution import load_factor, solve_contact
>>> from ridgebayes.contact.rigid_profile import Profile
>>> solution = solve_contact(Profile(0.012, 0.03, offset=0.2), load_factor(0.5) * 0.001)
>>> solution.Q, solution.status
(3, 'ok')
"""
