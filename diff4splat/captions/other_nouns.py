"""English nouns of objects that neither worlds nor cutouts have, for sentences about unknown ones.

A word that names nothing looks like none of these: networks that never see them take ``barrel`` for
``ball``.
"""

OTHER_NOUNS = tuple(
    """
acorn, aerial, airship, almond, altar, amulet, anvil, apron, aquarium, armour, ashtray, attic,
awning, axle, badminton net, bamboo, bandage, barbecue, barge, barn, barrow, baton, bayonet, beacon,
beak, beaker, beehive, belt, berry, bib, bishop, blackboard, blanket, blender, bobbin, bollard,
bolt, bonnet, booth, bracelet, bracket, branch, brazier, bridge, bridle, brooch, buggy, bugle,
bulldozer, bumper, bunk, bunting, buoy, bureau, button, buzzer, cabbage, cabin, cable, cage,
calendar, camcorder, canister, canopy, canvas, caravan, carafe, carburettor, card, carpet, carriage,
cart, cashew, casket, cauldron, celery, chainsaw, chalk, chalice, chandelier, chariot, cheetah,
chimney, chisel, chopsticks, cigar, clamp, claw, cleaver, cliff, clog, clove, coaster, cobweb,
cockpit, coil, colander, collar, conveyor, corkscrew, cot, counter, coupon, cradle, crane, crank,
crest, crossbow, crutch, cuff, cupboard, curtain, cushion, cutlass, cymbal, dartboard, deck, dice,
digger, dinghy, dome, doormat, dresser, drill, dumbbell, dustpan, easel, eel, elbow, elk, epaulette,
escalator, falcon, faucet, fern, ferret, ferry, fiddle, figurine, file, filing case, finch,
fireplace, flagstone, flail, flannel, flashlight, fleece, flipper, flint, folder, forge, fork,
fossil, frame, freezer, fridge, funnel, gable, gadget, gallows, garland, gauge, gazebo, gazelle,
gem, gherkin, girder, globe, goblet, gondola, gong, grater, grill, gramophone, grasshopper,
greenhouse, grille, gutter, gull, hairbrush, halo, halter, hammock, handbag, handle, hanger, hare,
harmonica, harness, hatch, hatchet, headset, hearth, heater, heron, hinge, hive, hoe, hoist, hood,
hoof, hoop, horseshoe, hose, hovercraft, hummingbird, hurdle, hydrant, iceberg, icicle, idol, igloo,
incense, ingot, inkwell, iron, ironing board, ivy, jackal, jack, javelin, jerrycan, jet, jewel,
jukebox, kayak, kennel, kerb, kettle, keyhole, kiln, kilt, kiosk, kitten, knapsack, knob, knot,
label, lace, ladle, lamb, lance, lark, lasso, latch, lathe, lattice, lawnmower, ledge, lens,
lettuce, lever, lid, lifebuoy, lift, lily, limousine, lintel, loaf, locket, locomotive, locust,
loom, loudspeaker, lute, lynx, mace, mallet, mandolin, manhole, mantelpiece, map, marble, marker,
mask, mast, mat, matchbox, mattress, meteor, metronome, mill, minaret, mole, monument, mop, mortar,
moth, motor, mould, mound, mousetrap, mule, napkin, necklace, needle, net, newt, nightstand, nozzle,
nut, nutcracker, oar, oboe, obelisk, omelette, orb, orchid, ornament, ostrich, ottoman, oven,
overcoat, oyster, paddle, padlock, pagoda, pallet, panther, parasol, parcel, parchment, parsnip,
partridge, pastry, pavilion, pebble, pedal, pedestal, pelican, pendant, pendulum, periscope, petal,
pew, pheasant, pigeon, pillow, pincers, pinwheel, pipe, pistol, piston, pitcher, plank, plaque,
pliers, plough, plum, podium, pony, porch, pouch, propeller, prism, pulley, punnet, puppet, puppy,
purse, pyramid, quail, quill, quilt, rack, radiator, radish, raft, rake, ramp, raspberry, rattle,
raven, reed, reel, reindeer, ribbon, rifle, robe, roller, roof, rosette, rucksack, rudder, rug,
saddle, safe, salad, salmon, satchel, saucepan, saucer, saw, scabbard, scaffold, scarecrow, sceptre,
screen, sculpture, scythe, seesaw, shack, shackle, shed, shelter, shrine, shutter, sickle, sieve,
signpost, silo, sink, skeleton, skillet, skirt, sledge, sleeve, sling, slipper, snare, snowflake,
socket, spade, spanner, spear, spindle, spire, spring, sprout, spur, stack, stake, stall, stapler,
starfish, steeple, stepladder, stilt, stirrup, stocking, stopper, stork, stove, strap, straw, stump,
submarine, sundial, switch, sword, tablet, tambourine, tank, tankard, tap, tapestry, tarpaulin,
tassel, teacup, teepee, tennis racquet, terrace, thermometer, thimble, thistle, throne, thumb,
ticket, tiara, tile, timber, toad, toast, toaster, tombstone, tongs, tongue, toothpick, totem, toy
soldier, trailer, trampoline, trap, trapdoor, tray, trellis, tricycle, trident, tripod, trolleybus,
trombone, trough, trowel, trunk, tuba, tulip, tunnel, turbine, turnip, turret, tusk, tweezers,
typewriter, ukulele, urn, valve, veil, ventilator, vessel, vine, visor, vulture, wagon,
walkie-talkie, wallet, walnut, walrus, wardrobe, warship, watch, wedge, weed, weight, well,
wheelbarrow, whisk, whistle, wick, wicket, wig, wok, woodpecker, wreath, wreck, yacht, yoke,
zeppelin, zipper
""".replace("\n", " ")
    .strip()
    .split(", ")
)
