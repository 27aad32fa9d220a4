"""Netlists as vendors and users of LTspice and PSpice write them, all made for these tests.

Each is driven at V1; ``REFUSED`` come with what is said of them.
"""

# The topology of Boyle, Cohn, Pederson and Solomon (1974), as data sheets have it; the values
# follow from a gain of 1e5, 1 MHz, 0.5 V/us and 50 Ohm.
BOYLE = """* connections:   non-inverting input
*                | inverting input
*                | | positive power supply
*                | | | negative power supply
*                | | | | output
.subckt OPX741   1 2 3 4 5
*
  c1   11 12 8.000E-12
  c2    6  7 30.00E-12
  dc    5 53 dx
  de   54  5 dx
  dlp  90 91 dx
  dln  92 90 dx
  dp    4  3 dx
  egnd 99  0 poly(2) (3,0) (4,0) 0 .5 .5
  fb    7 99 poly(5) vb vc ve vlp vln 0 10.00E6 -10E6 10E6 10E6 -10E6
  ga    6  0 11 12 188.5E-6
  gcm   0  6 10 99 5.961E-9
  iee  10  4 dc 15.16E-6
  hlim 90  0 vlim 1K
  q1   11  2 13 qx
  q2   12  1 14 qx
  r2    6  9 100.0E3
  rc1   3 11 5.305E3
  rc2   3 12 5.305E3
  re1  13 10 1.836E3
  re2  14 10 1.836E3
  ree  10 99 13.19E6
  ro1   8  5 50
  ro2   7 99 100
  rp    3  4 18.16E3
  vb    9  0 dc 0
  vc    3 53 dc 1
  ve   54  4 dc 1
  vlim  7  8 dc 0
  vlp  91  0 dc 40
  vln   0 92 dc 40
.model dx D(Is=800.0E-18 Rs=1)
.model qx NPN(Is=800.0E-18 Bf=93.75)
.ends
"""

# Input pair, stages of one pole about a middle rail, output stage; all dependent sources about it.
STAGES = """* AMPX2 SPICE Macro-model
* Node assignments: noninverting input, inverting input, positive supply, negative supply, output
.SUBCKT AMPX2 1 2 99 50 45
* INPUT STAGE
I1 8 50 1E-4
Q1 5 2 3 QN
Q2 6 9 4 QN
R1 99 5 5.2E2
R2 99 6 5.2E2
R3 3 8 1
R4 4 8 1
IOS 1 2 1NA
EOS 9 1 POLY(2) (73,98) (21,98) 25E-6 1 1E-7
* COMMON MODE GAIN STAGE
ECM 72 98 POLY(2) (1,98) (2,98) 0 0.5E-5 0.5E-5
RCM1 72 73 1E3
RCM2 73 98 1E3
* INTERNAL VOLTAGE REFERENCE
EREF 98 0 POLY(2) (99,0) (50,0) 0 0.5 0.5
GSY 99 50 POLY(1) (99,50) 1E-4 2E-6 1E-8
* GAIN STAGE
G1 98 21 (5,6) 1.0E-3
R7 21 98 1E8
C3 21 98 80PF
D3 21 41 DX
D4 42 21 DX
V3 99 41 1.7
V4 42 50 1.7
* OUTPUT STAGE
E1 44 98 POLY(1) (21,98) 0 1
R9 44 46 40
VS 46 45 0
F1 99 0 POLY(1) VS 0 0.5
.MODEL QN NPN(BF=120)
.MODEL DX D(IS=1E-16)
.ENDS AMPX2
"""

RUNS = {
    "Boyle's operational amplifier, inverting": f"""* an amplifier of a data sheet
V1 in 0 SIN(0 1 1k)
R1 in m 10k
R2 m out 100k
XU1 0 m vp vn out OPX741
Vp vp 0 15
Vn 0 vn 15
RL out 0 2k
{BOYLE}
.tran 1u 3m
.probe
.end
""",
    "operational amplifier of stages, follower": f"""AMPX2 as follower
V1 in 0 SIN(0 1 1k)
X1 in out vcc vee out AMPX2
Vcc vcc 0 DC 12
Vee vee 0 DC -12
Rl out 0 10k
{STAGES}
.TRAN 1u 3m
.PRINT TRAN V(out)
.END
""",
    "LTspice, UTF-16: a filter of real parts": """* C:\\Users\\Jörg\\Documents\\Filter µ.asc
V1 N001 0 SINE(0 1 1k) Rser=0.1
L1 N001 N002 330µ Ipk=1.2 Rser=0.35 Rpar=2k Cpar=12p mfg="Some Coils" pn="X-330"
C1 N002 0 10µ V=16 Irms=0.21 Rser=0.06 Lser=2n mfg="Some Caps" pn="Y" type="Al electrolytic"
R§Load N002 0 47Ω tol=1 pwr=0.25
D1 0 N002 D
.model D D
.lib C:\\Users\\Jörg\\AppData\\Local\\LTspice\\lib\\cmp\\standard.dio
.tran 0 3m 0 1µ startup
.options plotwinsize=0 numdgt=7
.backanno
.end
""",
    "LTspice IV, Latin-1: a transistor stage": """* D:\\Entwürfe\\Verstärker.asc
Q1 N002 N003 N004 0 NPN
R1 N001 N002 4k7
R2 N001 N003 47k
R3 N003 0 10k
R4 N004 0 1k
C1 N003 N005 1200µ
V2 N001 0 12
V1 N005 0 SINE(0 1 1k)
.model NPN NPN
.model PNP PNP
.lib D:\\Program Files (x86)\\LTC\\LTspiceIV\\lib\\cmp\\standard.bjt
.tran 3m
.meas TRAN ic_pp PP V(N002) FROM 1m TO 3m
;op
.backanno
.end
""",
    "LTspice: functions of behavioural sources": """* E:\\limits.asc
V1 in 0 SINE(0 1 1k)
.param w={2*pi*1k} hi=0.7 lo={-hi}
.func clip(x) {limit(x,lo,hi)}
B1 a 0 V=clip(V(in)) ; hard
B2 b 0 V=uplim(dnlim(V(in),-0.8,0.1),0.8,0.1)
B3 c 0 V=if(V(in)>0,V(in)**2,-0.5*V(in))
B4 d 0 V=table(V(in),-0.5,-1,0,0,0.5,2)
B6 f 0 V=2*buf(V(in))+inv(4*V(in))
B5 0 e I=1m*hypot(V(in),sin(w*time))
R5 e 0 1k
B7 g 0 V=atan2 (V(in),cos(w*time))
I8 0 h TBL(-1 -2m, 0 0 1 1m)
V8 h 0 SINE(0 2 1k)
B8 in k R=if (V(in)>0,1k,3k) Rpar=1G
V9 k 0 0
.tran 3m
.end
""",
    "PSpice: tables and expressions": """A comparator of PSpice's library
.PARAM VHIGH=5
V1 in 0 SIN(0 1 1k)
E1 a 0 VALUE {LIMIT(2*V(in), -1, 1)}
ETAB b 0 TABLE {V(in)-0.1} = (-5m,0) (5m,{VHIGH})
GTAB 0 c TABLE {V(in)} = (-1,-1m) (-.5,0) (.5,0) (1,1m)
RC c $N_0001 1K
VC $N_0001 0 0 $ of no use
H1 d 0 POLY(1) VS 0 1K 1MEG
VS b e 0
RS e 0 10K
.TRAN 1U 3M
.FOUR 1K V(b)
.END
""",
    "LTspice: a MOSFET, a switch and a transformer": """* driver
V1 in 0 SINE(0 1 1k)
V2 vdd 0 24
E1 g 0 in 0 10
M1 d g 0 0 FETX
R1 vdd d 100
S1 d x in 0 SWX
R2 x 0 1Meg
L1 in 0 10m Rser=1
L2 p 0 10m
L3 q 0 40m
K1 L1 L2 0.99
K2 L1 L3 0.99
K3 L2 L3 0.99
R3 p 0 1k
R4 q 0 1k
.model FETX VDMOS(Rg=3 Vto=4 Rd=5m Rs=5m Rb=10m Kp=30 Cgdmax=.5n Cgdmin=.05n Cgs=1n Cjo=.3n
+ Is=1p mfg=Somebody Vds=60 Ron=20m Qg=20n)
.model SWX SW(Ron=1 Roff=1Meg Vt=.5 Vh=0)
.tran 3m
.backanno
.end
""",
}
CODED = {"LTspice, UTF-16: a filter of real parts": "utf-16",
         "LTspice IV, Latin-1: a transistor stage": "latin-1"}  # fmt: skip

REFUSED = {
    "a counter": (
        "* x.asc\nV1 in 0 1\nA1 clk 0 0 0 0 0 q 0 COUNTER\nV2 clk 0 1\nR1 q 0 1k\n.tran 1m\n.end\n",
        r"own\.cir:3: A1 is no element that a netlist may have but .*; take a model for PSpice",
    ),
    "a filter in s": (
        "t\nV1 in 0 1\nE1 out 0 LAPLACE {V(in)} = {exp(-s*1u)}\nR1 out 0 1k\n.end\n",
        r"own\.cir:3: e1: LAPLACE takes a ratio of .*; write another filter with R and C\.",
    ),
    "an ideal diode": (
        "* x\nV1 in 0 1\nD1 in out DI\nR1 out 0 1k\n.model DI D(Ron=.1 Vfwd=.4 Ilimit=2)\n.end\n",
        r"own\.cir:5: ilimit of di is LTspice's ideal diode; write is, n and rs, or a B source\.",
    ),
}
